"""The people's tool: scripts missions, flies vehicles, records what they say, refits, redesigns and
reports."""
