"""Libraries that crash, hang or chatter on files of strangers, each call in a process of its own.

`process` is the side of ccfem; the other modules run in the child and import nothing of ccfem but
its errors, so that a child starts quickly.
"""
