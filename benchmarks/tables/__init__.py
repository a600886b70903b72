"""The tables of the page, a module each.

A table has ``TITLE``, ``cells(quick)``, what is to be measured; ``measure(cell)``, the figures of one; ``text(lines)``,
its section of the page; ``cited(lines)``, figures that may be cited, by key; ``behind(lines)``, where we are behind.
"""
