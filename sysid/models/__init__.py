"""Model structures: linear planes, grey-box model, noise models and the model file."""
