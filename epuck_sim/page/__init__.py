"""Pages: a scenario as one HTML file, in which the program's own kernels run as WebAssembly.

`roots` says what a page's WebAssembly is made of, and where it is, `build` makes it, `agents` and `robots` say what a
page needs to know of a scenario, `writer` writes the page, and `web/` is what runs in the browser.
"""
