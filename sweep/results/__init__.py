"""What a result says, and what is made of it: statuses, choices, differences, joined results, exports, lists.

Others may use `statuses`, `filter`, `export`, `units`, `diff`, `join`, `listing`.
"""
