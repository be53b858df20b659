"""The plant held against what is not ours: balances, closed forms, independent models; each as numbers and figures."""
