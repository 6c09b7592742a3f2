"""What a verb refuses itself: exit code 1, one line that says why, and no file is written.

What a function of the package refuses is tested with that function.
"""

import shlex

import pytest

from tests.helpers.commandline import refused, table_of

REFUSED = """
run sea.parquet --filter mahony --out none/x.parquet | there is no folder none
run rest.parquet --filter mahony,vqf | run takes one filter
run rest.parquet --filter mahony --frame NEU | NEU
run rest.parquet --filter mahony --params gate=0.08 | needs a unit
run rest.parquet --filter mekf --card x.json | --card is for the smoother
run sea.bin --filter mahony | sea.bin
run sea.parquet --filter mekf --report a.txt | --report needs a name that ends in .html
run rest.parquet --filter mahony --calibration other.json | the card is for device 'unit 8'
run sea.parquet --filter mekf --noise sea.parquet | is not a plumbob noise card
run sea.parquet --filter mahony --noise noise.json | mahony has no parameter that a noise card could give
run rest.parquet --filter tilt_compass --date 2028-07-04 | date needs place
replay sea.mcap --filter mahony,vqf | replay takes one filter
replay sea.mcap --filter mahony --frame NEU | NEU
replay sea.mcap --speed 0 | --speed must be above 0, but it is 0
replay sea.mcap --speed nan | --speed must be above 0, but it is nan
replay sea.mcap --params kp=1 | --params, --noise and --init belong to a filter
replay sea.mcap --calibration other.json | the card is for 'unit 8'
convert sea.parquet x.parquet --calibration card.json --what attitude | holds an attitude but no samples
sim bouy --frame ENU --out x.parquet | known are
sim buoy --frame ENU --sensors mpu6000 --out x.parquet | --unit
sim buoy --chain arm --frame NED --out x.parquet | not a program of a chain
sim fast --frame NED --out x.parquet | --chain arm
sim fast --chain leg --frame NED --out x.parquet | 'leg' is not a chain
sim teach --frame NED --out x.parquet --set jitter=1ms | one time line
sim teach --frame NED --out x.parquet --set soft=maybe | yes or no
sim teach --frame NED --out x.parquet --set mount_angle=5 | unit
emulate teach --set wave=3 --write x.bin | no setting 'wave'
emulate teach --scenario buoy --write x.bin | not a program of a chain
emulate teach --set bend=20uT,bend_at=base --write x.bin | not at 'base'
emulate mpu6000 | --scenario buoy
emulate arm --noise u1=noise.json --noise card.json | one card for all units
emulate arm --noise u1=none.json | none.json
emulate buoy --speed fast | or max
emulate buoy --set height=1m | name it with --scenario
emulate mpu6000 --scenario static --rate 10Hz --duration 1s --tcp :65536 | HOST:PORT
emulate buoy --warm-up '15 K' | RISE, TIME
emulate buoy --faults flip | name=value
list devices --c | name a device
list devices nothing | not a known device
decode empty.bin --format buoy | empty.bin is empty. Give a file of raw bytes.
decode bad.txt --format buoy | none of its 330 bytes is a frame of buoy.
decode sea.bin --format buoy --message x | no message 'x'
decode sea.bin --format buoy --rate '20 ms' | not a unit of frequency
decode sea.bin --format buoy --out x.xls | ends in .csv or .txt or .parquet or .json
decode sea.bin --format mpu6000 --option gyr_range | NAME=VALUE
decode sea.bin --format mpu6000 --option 'gyr_range=300 deg/s' | must be one of
decode sea.bin --format buoy --unit u7 --out x.csv | has no unit 'u7'
decode . --format buoy | is a folder; name a file.
record | either a session file, or --port
record --port /dev/null | need --format
record --port /dev/nowhere --format buoy | no serial port
record --port /dev/nowhere --format buoy --text no/a.txt | no folder no
record --port /dev/null --format bouy | not a known device
record --port /dev/null --format buoy --filter mekf | frame
record --port /dev/null --format buoy --duration 10deg | deg
record --iio x --format buoy | takes no --format
record --iio x --port y | give either
record --iio no-such-chip --out a.mcap | There is no IIO device no-such-chip
verify bad.txt | is not an MCAP file
allan one.txt {n} --deviation mdev --methods --curve | does not go with --methods, --curve
allan one.txt {n} --deviation mdev --device A | does not go with --device
allan one.txt {n} --deviation mdev --card x.json | does not go with --card
allan one.txt {n} --after one.txt --curve | does not go with --curve
allan one.txt {n} --after one.txt --html x.html --device A | does not go with --device
allan one.txt {n} --after three.npy | compare
allan one.txt {n} --paper fin --json | does not go with --json
allan one.txt {n} --device A --plot x.png | --device is for --card or --html
allan one.txt {n} --topic /imu1 | --topic is for --kalibr
allan one.txt {n} --triads gyr | holds plain numbers, but --triads is for recordings
allan three.npy {n} --profile bad.txt | holds plain numbers, but --profile is for recordings
allan one.txt {n} --calibration card.json | --calibration is for recordings
allan one.txt {n} --plot x.jpg | --plot needs a name that ends in .svg or .png or .pdf
allan one.txt {n} --lang zh | --lang is for --html or --plot, which is not given
allan one.txt {n} --html x.png | --html needs a name that ends in .html or .htm
allan one.txt {n} --kalibr . | is a folder
allan one.txt {n} --card x.json --kalibr ./x.json | x.json is named for two outputs
allan one.txt {n} --taus 0.015 | is not a multiple of the sampling time
allan one.txt {n} --skip 5s | --skip needs a span as 0s..5s
calibrate accel rest.parquet --gravity '9.8 m/s2' --latitude '50 deg' | Give one
calibrate accel rest.parquet --height '40 m' | needs latitude
calibrate accel rest.parquet --latitude '95 deg' | latitude is from
calibrate accel rest.parquet --from 200s | nothing lies
calibrate hand rest.parquet --place 0,0 --latitude '0 deg' | Give one
calibrate gyro rest.parquet --angle 360deg | belongs to --method ferraris
calibrate gyro rest.parquet --preset trackball --method rest | --preset does not go with --method
calibrate gyro rest.parquet --method ferraris --parts p.csv --part-column part | --parts does not go with --part-column
calibrate mag rest.parquet --shape level --tilt 9deg | tilt has no effect
calibrate mag rest.parquet --in-use --with acc | leave them out
calibrate mag --in-use --live --port /dev/null | does not go with --live
calibrate mount rest.parquet | Give one of ENU
calibrate mount rest.parquet --frame NED --level 0s --raised 1s..2s | 0s..5s
calibrate mount rest.parquet --reference sea.parquet | belong together
calibrate mount rest.parquet --reference sea.parquet --estimate track.parquet --frame NED | needs no poses
calibrate statictest track.parquet --calibration card.json | no sensor data
calibrate mag | name the recording
calibrate mag rest.parquet --port /dev/null | --live
calibrate mag --live --out x.json | either a session file, or --port
calibrate mag --live --port /dev/null --format buoy | needs --out
calibrate mag --live --port /dev/null --format buoy --out no/x.json | no/x.json
calibrate mag --live --port /dev/null --format buoy --out x.json | --device
calibrate mag --live --port /dev/null --format trackball --device x --out x.json | the line has no mag, only gyr
calibrate gyro --live --method hand --port x --out x.json | guides a rest only
calibrate mag --live --to 5s --out x.json | --live does not go with --to
arm export angles.parquet --out p.bag | --out takes names
arm export angles.parquet --out m.urdf | name its file with --chain
arm export angles.parquet --out p.csv --rate '5 m' | not a unit of frequency
arm export angles.parquet --chain angles.parquet --out p.csv | UTF-8
arm replay angles.parquet angles.parquet | a model is a chain
arm replay angles.parquet arm.toml --truth angles.parquet | no place of the hand
arm replay angles.parquet arm.toml --hand x | --hand names a link
array info sea.parquet | holds one unit
array combine sea.mcap --out x.tum | --out needs a name that ends in .mcap
report sea.parquet --out x.pdf | --out needs a name that ends in .html or .htm
report sea.parquet --pdf x.html | --pdf needs a name that ends in .pdf
report sea.parquet --lang zh | --lang is for --out or --pdf
report sea.parquet --filter mahony,mekf | report takes one filter
report rest.parquet --filter mekf --burst '0 s' | burst must be above 0
report rest.parquet --filter mekf --tilt-limit '3 m' | 'm' is not a unit of angle
report rest.parquet --filter mekf --tilt-limit '180 deg' | an inclination is below 180°
report sea.parquet --figure rates --out x.txt | the name of a picture must end in
report sea.parquet --figure rates --filter none --from 90s --out x.svg | no sample lies between
report sea.parquet --figure rates --width=-5mm --out x.svg | picture is 30 to 1000 mm
report sea.parquet --figure rates --width=85 --out x.svg | picture is 30 to 1000 mm
info sea.parquet --min-grade 101 | 101
benchmark accuracy . --filters mahony --gaps five | gaps needs their number and length, as 5x1s
benchmark accuracy . --filters mahony --wrong-field 1,2,3uT | wrong_field needs field and times
benchmark accuracy . --filters mahony --bias 1,2dps | has 2 numbers
benchmark accuracy . --filters mahony --between 3s | --between needs a span as 0s..5s
benchmark accuracy . --filters mahony --against vqf | there is no 'vqf' to compare with
benchmark accuracy . --filters mahony --noise noise.json | mahony has no parameter that a noise card could give
benchmark scenario static --frame NED --filters mahony --noise own | mahony has no parameter that a noise card could
list references kalman | there is no filter 'kalman'; known are complementary
list filters mahoni | Did you mean 'mahony'?
run sea.parquet --filter mahony --params kpp=1 | Did you mean 'kp'?
docs ../time.txt | There is no page '../time.txt'; there are accuracy, acquire
"""


@pytest.mark.parametrize(("words", "why"), table_of(REFUSED), ids=lambda cell: cell)
def test_what_a_verb_refuses_is_one_line_and_writes_nothing(samples, words, why):
    before = sorted(samples.rglob("*"))
    assert why in refused(*shlex.split(words.format(n="--rate 100Hz --scale '1 deg/s'")), cwd=samples)
    assert sorted(samples.rglob("*")) == before
