"""The door of a method's node: one task at a time, the newest; answered once, whatever happens."""

from push_job.method import Task
from push_model.jobs import GoalRefused, JobError
from push_ros.door import Door

FIRST, SECOND = Task((1,)), Task((2,))


def slow(task):
    """Ten slices of 1 ms; the second task is refused in the end."""
    for _ in range(10):
        yield 1000
    if task is SECOND:
        raise GoalRefused(JobError.PLANNING_FAILED, "no way")


def test_a_task_is_answered_after_as_many_frames_as_it_takes():
    for task, code in ((FIRST, None), (SECOND, JobError.PLANNING_FAILED)):
        door, answers = Door(slow), []
        door.ask(task, answers.append)
        frames = 0
        while door.busy:
            assert not answers
            door.go_on()
            frames += 1
        assert frames == 5  # 10 slices, two with the question and in each frame; then the end
        assert [a and a.code for a in answers] == [code]
        door.go_on()
        door.drop(JobError.CANCELED, "canceled")
        assert len(answers) == 1


def test_what_is_quickly_known_is_answered_at_once():
    door, answers = Door(lambda task: iter(())), []
    door.ask(FIRST, answers.append)
    assert answers == [None] and not door.busy


def test_a_task_that_comes_meanwhile_takes_the_place_of_the_first():
    door, answers = Door(slow), []
    door.ask(FIRST, lambda refusal: answers.append((1, refusal.code)))
    door.ask(SECOND, lambda refusal: answers.append((2, refusal.code)))
    assert answers == [(1, JobError.PREEMPTED)]
    while door.busy:
        door.go_on()
    assert answers[1:] == [(2, JobError.PLANNING_FAILED)]


def test_a_task_that_is_dropped_is_answered_with_the_reason():
    door, answers = Door(slow), []
    door.ask(FIRST, answers.append)
    door.drop(JobError.CANCELED, "canceled")
    assert answers[0].code is JobError.CANCELED and not door.busy
