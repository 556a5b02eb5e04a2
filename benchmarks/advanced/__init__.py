"""Does a law with a model inside hold the vehicle better than PIDs of the same specification?"""
