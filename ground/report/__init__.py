"""What a campaign showed, as one page that needs nothing but a browser."""
