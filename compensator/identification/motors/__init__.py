"""Identification of mechanisms with several motors: pairs and fingers."""
