"""`tendonff watch`: drift of a joint's friction and pre-tension over what its motor felt day by day."""
