"""The pipeline: steps whose results are kept, and who does them.

    @step(rooms=("recordings",), stage="read")
    def count(job: Job, parameters: Count) -> None:
        (job.folder / "count.json").write_text(...)

    with Store(Path("renders/hand")) as store, ProcessExecutor(2) as executor:

        def plan():
            counting = Task(count, Count("x"), "count hand", inputs=(store.input("hand.csv"),))
            yield counting
            yield Task(report, Report(), "report", after=(counting.key,), publish={"report.html": "report.html"})

        Run(store, executor).do(plan)

A result is kept under a digest of all that it depends on, so a second run does only what is missing or has changed,
and whatever is killed, the same call goes on from there.
"""
