"""The sliding tendon: masses, links and contacts, assembled into a chain."""
