"""Report of a campaign: one page that a browser shows without a network."""
