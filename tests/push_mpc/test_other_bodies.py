import numpy as np

from push_mpc.other_bodies import kept_off


def test_bodies_keep_their_distance_and_one_that_came_closer_the_distance_it_has():
    me = np.array([1.0, 1.0, 0.3])
    bodies = np.array([[4.0, 5.0, 0.2], [1.0, 1.1, 0.3]])
    assert np.allclose(kept_off(me, bodies), [[4.0, 5.0, 0.2], [1.0, 1.1, 0.1]])
    assert kept_off(me, np.zeros((0, 3))).shape == (0, 3)
