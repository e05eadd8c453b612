"""`make bench-reliability`: does the service keep what it says, whatever is sent to it and whatever happens to it?

Each part runs against a real server in a process of its own (the readers in this one), and leaves what it did, what it
counted and how long that took in docs/results/reliability_<part>.json. docs/reliability.md is written from those alone.

contract                        part `contract`: whatever the OpenAPI document allows, and much that it does not
fuzz_readers, fuzz_targets, fuzz_inputs
                                part `readers`: a million inputs; the readers that get them; how they are made
load, traffic, trees            part `load`: a fleet at work; its clients; forests for what they store
per_session                     part `fleet`: who has been here, and when
upload_beside_queries           part `season`: a large upload while robots go on asking
meetings, meetings_report       part `meetings`: a submap alone, and robots that store at once
shape_costs, worst_shapes, shape_costs_report
                                part `shapes`: the costliest shapes of landmarks
hostile/, hostile_report        part `hostile`: slow callers, large bodies, kills, a full disk, a clock that jumps
exhaustion/                     part `exhaustion`: small requests that ask for much
prefilled                       databases filled by the library before a service starts
"""
