"""Several driven joints on tendons that cross them: scenario, compensators and design."""
