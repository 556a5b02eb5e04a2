"""Linear estimates of one plane at a time: the small-signal plane, its tailcone, and nothing that
comes from size.

``plant`` says what is estimated, ``response`` what a plant does under logged commands and how that
changes with every value, ``records`` what a run is to these estimators. ``output_error`` takes what
remains for sensor noise, ``filter_error`` for the sea. ``search`` starts either from many places
and refuses what is not unique, ``bound`` tells how well any estimator could do, and ``report``
writes the model."""
