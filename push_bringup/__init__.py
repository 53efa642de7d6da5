"""Which nodes make up a system; start them, watch them, talk to them."""
