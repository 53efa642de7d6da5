"""Launch, record, watch and evaluate: the command line and what stands behind it."""
