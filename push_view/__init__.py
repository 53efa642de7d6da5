"""What a person sees: a live page, and reports from bags."""
