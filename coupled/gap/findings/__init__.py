"""Results of the search: verdict, estimates, credibility, budget, flights and the next test."""
