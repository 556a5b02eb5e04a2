"""The pure tick: sensor checks, estimator, navigation, modes, missions, guidance and loops."""
