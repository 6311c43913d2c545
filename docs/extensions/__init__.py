"""What the site needs beside Sphinx's own extensions: each module is one of them."""
