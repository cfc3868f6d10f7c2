"""The optimal force: which search solves a tracking problem, and cycles of it."""
