"""The pipeline: steps whose results are kept, and the executors that do them.

    with Store(Path("renders/hand")) as store, ProcessExecutor(2) as executor, Progress() as progress:

        def plan():
            yield (counting := Task(Count("x"), "count hand", inputs=store.inputs("hand.csv")))
            yield Task(Report(), "report", after=(counting.key,), publish={"report.html": "report.html"})

        Run(store, executor, progress).do(plan)

A result is stored under a digest of everything that it depends on, so a second run does only what is missing or has
changed. If a run is killed, the same call continues from there.
"""
