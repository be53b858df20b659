"""Takes the project itself and gives evidence about it: how right its models are, how good its answers, how fast it is.

`reference_car` and `blind_trials` test the diagnosis, `verify` and `reproduce` the plant and the paper's claims, `perf`
the speed; `sensitivities` says what a manoeuvre can show, `doc_pages` writes the generated pages of the documents.
"""
