"""From numbers to a page: findings in words, charts, and the HTML that holds them."""
