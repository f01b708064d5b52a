"""Tasks of other packages as worlds: a family of them is a module, a task is "FAMILY:TASK".

``worlds.families.FAMILIES`` names the module of each family. Its function ``entry(task)`` returns
the ``tasks.TaskEntry`` of one of its tasks, whose ``world_class`` is a ``tasks.TaskWorld``. This
package has the rest, as far as a family does not replace it::

    tasks       settings, world and registry entry of a task
    actions     from the outputs of controllers to the actions of a task
    labels      the label of each action, which decides castes
    teams       tasks in which only some agents are robots: which, and what the others do
    functions   a user's function as a setting: labels, others
    networks    the controllers of many robots at once, in numpy
    playing     the simulator: epochs of many teams side by side, step by step
"""
