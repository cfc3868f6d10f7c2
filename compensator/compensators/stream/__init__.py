"""References that arrive live: the filter before the exact inverse, designed and modelled."""
