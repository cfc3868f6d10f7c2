"""The output estimated from what the near end measures."""
