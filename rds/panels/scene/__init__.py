"""The machine in motion, drawn by the browser: its bodies, its trail, and the stock that it cuts."""
