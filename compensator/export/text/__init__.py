"""The text of exported C."""
