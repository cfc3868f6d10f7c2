"""The fit where the input is noisy: estimated with the values, and the law judged again."""
