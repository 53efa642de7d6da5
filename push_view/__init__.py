"""What a person sees: reports from bags, and a live view."""
