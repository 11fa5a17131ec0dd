"""A second bench, written from published equations by someone who has not read the product: see
README.md.

It imports nothing of the project.  Its only interface is the recording format.
"""
