"""Other people's swarms, reconstructed from their papers, for the experiment swarm-rivals."""
