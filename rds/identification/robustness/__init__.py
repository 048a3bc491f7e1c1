"""How a design fares over everything that an axis may be: closed loops with drawn parameters, thousands of them."""
