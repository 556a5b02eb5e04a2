"""Monte-Carlo study of identification with four vehicles; each figure has a target."""
