"""Pages: a scenario as one HTML file, in which the program's own kernels run as WebAssembly.

`roots` lists the kernels in a page's WebAssembly, and finds the file; `build` makes it; `agents` and `robots` give the
facts of a scenario that a page needs; `writer` writes the page; and `web/` runs in the browser.
"""
