"""Speed of every part, each figure beside a floor or a peer that is measured in the same run.

A floor is the least time that the operating system or the processor needs for the same work; a peer
is another program that does the same work. `rows` describes the figures and their targets,
`results` is the record of a run, and the other modules measure one group of rows each.
"""
