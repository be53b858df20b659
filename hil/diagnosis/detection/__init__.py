"""Detection: forward selection of causes.

Takes a dataset, the vehicle and its nominal parameter set; gives a `result.Diagnosis`: the accepted causes with their
fitted model, and what was fitted in the place of each.

Reading path: `stepwise` runs the selection and reads as the whole; `candidates` and `score_test` say what each
candidate gains by one linear step, `profile_fit` fits the best, `restart` fits them from the nominal vehicle too,
`onset` finds when they start; `nonparametric`, `group_score_test` and `nonparametric_search` hold unknown functions
against them, `shape` effects with another shape; `significance` decides, by the constants of `threshold`.
"""
