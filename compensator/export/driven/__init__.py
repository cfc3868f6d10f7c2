"""Modules beside the inverse in exports of driven joints."""
