"""The pipeline: steps whose results are kept, and who does them.

    with Store(Path("renders/hand")) as store, ProcessExecutor(2) as executor, Progress() as progress:

        def plan():
            yield (counting := Task(Count("x"), "count hand", inputs=store.inputs("hand.csv")))
            yield Task(Report(), "report", after=(counting.key,), publish={"report.html": "report.html"})

        Run(store, executor, progress).do(plan)

A result is kept under a digest of all that it depends on, so a second run does only what is missing or has changed,
and whatever is killed, the same call goes on from there.
"""
