"""The joint estimate of both planes: what the fit sees, its sensitivities, its search, and when it
has failed."""
