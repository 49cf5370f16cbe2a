"""A result as a page in the browser, to walk through it; the only room that imports panel and bokeh.

Others may use
    `server`   serve: the page of a result on this machine, until Ctrl-C

`slices` says what is shown and reads no more than that, `region` saves it, `picture` draws it, `page` has the controls.
"""
