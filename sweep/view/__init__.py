"""A result as a page in the browser, to walk through it; the only room that imports panel and bokeh.

Others may use
    `page`   serve: the page of a result on this machine, until Ctrl-C

`region` says what is shown, reads no more than that, and saves it; `picture` draws it.
"""
