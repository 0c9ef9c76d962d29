"""The figures of the page drawn elsewhere: by Plotly in Python, by matplotlib for papers."""
