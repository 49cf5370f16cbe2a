"""Figures, HTML pages and text for people. It runs nothing, and is the only room that imports matplotlib.

Others may use
    `figures`  plot: figures of results, work-precision charts and comparisons of laws
    `charts`   for figures of your own: style, new_figure, save, and the look of each method
    `accessor` `ds.sweep`, the accessor of Datasets
    `page`     write_page: a result as one page of HTML
    `text`     result_text: what `sweep show` prints
    `laws`     fits and comparisons of laws, as text and csv; pick: cells by the values of axes
    `studies`  the studies that come with foliot, and copies of them
    `kernels`  descriptions of kernels, as text and HTML, and example studies

`view` selects and labels what `figures` draws.
"""
