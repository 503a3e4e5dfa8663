"""The live explorer: a page on this computer that shows the theory, the branch and a living cell.

`server` gives the page and its messages, `worker` computes in processes of their own, `live` is the
cell that lives, `answers` is what a parameter point looks like, `offline` the page in one file.
"""
