"""Results for people: pictures, pages and words. Runs nothing; the only room that imports matplotlib.

Others may use
    `figures`  plot, of whatever it is given
    `charts`   for figures of one's own: style, new_figure, save, and the line of a method
    `accessor` `ds.sweep`: what a Dataset of a sweep can do by itself
    `page`     write_page: a result as one page of HTML
    `text`     result_text; a sweep watched from its log
    `laws`     power laws along an axis and which law, as text and csv; pick
    `studies`  what comes with foliot, and copies to work on
    `kernels`  what can be swept, as text and HTML, and a study to begin with

`view` chooses and letters what `figures` draws.
"""
