"""What is said of the effects found: budget, credibility, flight, verdict, next test."""
