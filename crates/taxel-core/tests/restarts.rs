//! Property tests of boards that are reset or killed and started again: each step back of times is listed, whatever the
//! network does, and a restart makes none where it can be told from a delayed datagram.

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use taxel_core::board::{Board, BoardOptions, Version2};
use taxel_core::events::FARTHEST_BACK_US;
use taxel_core::wire::{Decoder, Registers, SenderDecoder, StepBack};
use taxel_core::{Array, Events};

const FRAME_US: i64 = 192;

/// The datagrams of a board from one start to its end, each with the time since the start, us.
fn life(random: &mut StdRng, version: u8, session: u16, frames: i64) -> Vec<(i64, Vec<u8>)> {
    let how = Version2 { seed: session, states_us: [0, 30_000][random.random_range(0..2)], ..Version2::default() };
    let registers = Registers { wire_version: version, ..Registers::default() };
    let mut board =
        Board::with_options(registers, &Array::thesis(), BoardOptions { version_2: how, ..BoardOptions::default() })
            .unwrap();
    let (mut ticks, mut sent) = (vec![40_u16; 4096], vec![]);
    for frame in 0..frames {
        if random.random_range(0..4) == 0 {
            for _ in 0..random.random_range(0..5) {
                ticks[random.random_range(0..4096)] = random.random_range(0..150);
            }
        }
        board
            .frame(&ticks, |datagram| {
                sent.push(((frame + 1) * FRAME_US, datagram.to_vec()));
                true
            })
            .unwrap();
    }
    sent
}

/// The steps back in a list of times, from their definition.
fn steps_of(times: &[i64]) -> Vec<StepBack> {
    let mut steps: Vec<StepBack> = vec![];
    for k in 1..times.len() {
        let latest = *times[..k].iter().max().unwrap();
        let before = *times[..k - 1].iter().max().unwrap_or(&i64::MIN);
        if times[k] >= latest {
            continue;
        }
        if k == 1 || times[k - 1] >= before {
            steps.push(StepBack { after_us: latest, by_us: 0, events: 0 });
        }
        let step = steps.last_mut().unwrap();
        (step.by_us, step.events) = (step.by_us.max(latest - times[k]), step.events + 1);
    }
    steps
}

#[test]
fn every_step_back_is_listed_over_any_restarts_and_any_network() {
    let (mut far, mut near) = (0, 0);
    for seed in 0..150 {
        let mut random = StdRng::seed_from_u64(seed);
        let (mut start, mut arriving) = (random.random_range(0..1 << 40), vec![]);
        let wires: &[u8] = [&[1][..], &[2], &[1, 2]][random.random_range(0..3)];
        let (lost, repeated, late) =
            ([0.0, 0.1][random.random_range(0..2)], [0.0, 0.1][random.random_range(0..2)], random.random_range(0..4));
        for _ in 0..random.random_range(1..6) {
            let version = wires[random.random_range(0..wires.len())];
            let (session, frames) = (random.random_range(1..3), random.random_range(1..900));
            for (t, datagram) in life(&mut random, version, session, frames) {
                if random.random_bool(lost) {
                    continue;
                }
                for _ in 0..=u8::from(random.random_bool(repeated)) {
                    let delay = match late {
                        0 => 0,
                        1 => random.random_range(0..500),
                        2 => random.random_range(0..20) / 19 * random.random_range(0..30_000),
                        _ => random.random_range(0..100) / 99 * random.random_range(0..2_000_000),
                    };
                    arriving.push((start + t + delay, datagram.clone()));
                }
            }
            let gaps = [0, 100, 20_000, 60_000, 1_000_000, 6_553_600, 7_000_000, 3_600_000_000];
            start += frames * FRAME_US + gaps[random.random_range(0..gaps.len())];
        }
        arriving.sort_by_key(|(at, _)| *at);
        let joins = random.random_range(0..=arriving.len().min(40));
        let knows_arrival = random.random_bool(0.8);
        let mut sender = SenderDecoder::new(Decoder::new(Array::thesis()), 1);
        let mut events = Events::empty(Array::thesis());
        let mut second = vec![];
        for (at, datagram) in &arriving[joins..] {
            let info = sender.push(datagram, knows_arrival.then_some(*at), &mut events);
            second.resize(events.len(), info.version == 2);
        }
        let mut latest = i64::MIN;
        let (mut overtaken, mut behind) = (0, 0);
        for (&t, &second) in events.t.iter().zip(&second) {
            overtaken += u64::from(second && t < latest && latest - t <= FARTHEST_BACK_US);
            behind += u64::from(second && t < latest && latest - t > FARTHEST_BACK_US);
            latest = latest.max(t);
        }
        let (totals, steps, expected) = (sender.totals(), sender.steps_back(), steps_of(&events.t));
        assert_eq!((totals.overtaken, totals.far_behind), (overtaken, behind), "seed {seed}");
        assert_eq!(totals.steps_back, expected.len() as u64, "seed {seed}");
        if expected.len() <= 256 {
            assert_eq!(steps, expected, "seed {seed}");
        } else {
            let least = steps.iter().map(|step| step.by_us).min().unwrap();
            assert_eq!(steps.len(), 256);
            assert!(expected.iter().filter(|step| step.by_us > least).count() <= 256, "seed {seed}: the largest");
        }
        far += behind;
        near += overtaken;
    }
    assert!(far > 100 && near > 100, "the draws have both: {far}, {near}");
}

#[test]
fn a_killed_board_that_starts_again_with_the_same_session_makes_no_step_back() {
    for seed in 0..40 {
        let mut random = StdRng::seed_from_u64(900 + seed);
        let (mut start, mut arriving, lives) = (5_000_000, vec![], random.random_range(2..5));
        for _ in 0..lives {
            let frames = random.random_range(600..2500);
            arriving.extend(life(&mut random, 2, 7, frames).into_iter().map(|(t, datagram)| (start + t, datagram)));
            start += frames * FRAME_US + [50_000, 300_000, 5_000_000, 3_600_000_000][random.random_range(0..4)];
        }
        // The host joins while the board sends, or some of the first datagrams are lost.
        arriving.drain(..random.random_range(1..30));
        let mut sender = SenderDecoder::new(Decoder::new(Array::thesis()), 1);
        let mut events = Events::empty(Array::thesis());
        let resets =
            arriving.iter().filter(|(at, datagram)| sender.push(datagram, Some(*at), &mut events).reset).count();
        assert!(events.t.is_sorted(), "seed {seed}");
        assert_eq!((sender.totals().steps_back, resets), (0, lives - 1), "seed {seed}");
    }
}

#[test]
fn one_delayed_datagram_is_no_restart() {
    for seed in 0..20 {
        let mut random = StdRng::seed_from_u64(1700 + seed);
        let mut arriving = life(&mut random, 2, 7, 4000);
        let late = random.random_range(1..20);
        let at = random.random_range(600..arriving.len());
        let (_, datagram) = arriving.remove(late);
        arriving.insert(at, (arriving[at].0, datagram));
        let mut sender = SenderDecoder::new(Decoder::new(Array::thesis()), 1);
        let mut events = Events::empty(Array::thesis());
        for (at, datagram) in &arriving[1..] {
            sender.push(datagram, Some(9_000_000 + at), &mut events);
        }
        assert_eq!((sender.version_2().counts().resets, sender.version_2().counts().missing), (0, 0), "seed {seed}");
    }
}
