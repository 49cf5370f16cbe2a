"""Operations on results: statuses, selections, differences, joins, exports, lists.

Others may use `statuses`, `filter`, `export`, `units`, `diff`, `join`, `listing`.
"""
