"""Result of identification as a user meets it: messages, figures, report."""
