"""The leaderboard: methods beside each other on equal tasks, with equal worlds and tolerances."""
