"""Result: takes a diagnosis, gives the answer as JSON, its report, its held-out error and the extended scenario."""
