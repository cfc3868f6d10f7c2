"""Self-tuning: a model beside the rig, the recursion that tunes it, its information, and what is certain about it."""
