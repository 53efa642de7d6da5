"""The live page, and reports from bags."""
