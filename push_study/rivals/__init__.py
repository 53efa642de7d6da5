"""Methods that ours are compared with: other people's, reconstructed, and a baseline."""
