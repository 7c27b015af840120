#!/usr/bin/env bash
# Simulated situations, the network trained in simulation, and its six fine-tuned versions. From the project after `make setup` and `dvc repro fetch`.
set -euo pipefail
cd "$(dirname "$0")"
export PATH="$PWD/../.venv/bin:$PATH" PYTHONPATH="$PWD/.." OMP_WAIT_POLICY=PASSIVE OMP_NUM_THREADS=1
places="eth hotel corner t_junction bottleneck crossing"
shape="rays=96 crop=(32,.3,-2.7) sym=1 modes=3 prior_mode=0 bs=256 width=384 data=train"

python gen.py test sim_test 0 10
for kind in corridor bottleneck room open; do python gen.py val $kind 100000 100024 300; done
python gen.py train lone 0 60 300
for i in 0 75 150 225; do python gen.py train main $i $((i + 75)); done
for i in 0 100 200; do python gen.py train corridor $i $((i + 100)) 500; python gen.py train open $i $((i + 100)) 500; done
for i in 0 60 120; do python gen.py train bottleneck $i $((i + 60)) 700; python gen.py train room $i $((i + 60)) 600; done
python realrows.py
python train.py simulation steps=18000 $shape best=.3 "mix={'main':.33,'corridor':.2,'bottleneck':.15,'room':.14,'open':.15,'lone':.03}"
for left_out in $places; do
    others=$(for place in $places; do [ "$place" = "$left_out" ] || printf "'%s'," "$place"; done)
    python train.py "without_$left_out" init=nets/simulation.pt steps=300 lr=8e-4 $shape best=.2 most=2500 "real=[$others]" real_share=.5 \
        "real_eval=['$left_out']" "mix={'main':.36,'corridor':.19,'bottleneck':.14,'room':.13,'open':.15,'lone':.03}"
done
python laws.py simulation
python scenes_eval.py simulation
