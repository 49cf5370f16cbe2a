"""The viewer: a result as a page in the browser. The only room that imports panel and bokeh.

Others may use
    `page`   serve: serves the page of a result on this machine, until Ctrl-C

`region` selects, reads and saves what is shown; `picture` draws it.
"""
