//! On files that libhdf5 writes in its earliest and its latest format, whole, cut and turned.

use super::{Refusal, contents, integers, read, reals};
use crate::formats::hdf5_file::write;
use hdf5::{File, FileBuilder, Group};
use std::path::Path;

fn create(path: &Path, is_latest: bool) -> File {
    let mut builder = FileBuilder::new();
    builder.with_fapl(|plist| if is_latest { plist.libver_latest() } else { plist.libver_earliest() });
    builder.create(path).unwrap()
}

/// The bytes of a file that is written in one of the formats.
fn bytes_of(is_latest: bool, fill: impl Fn(&File)) -> Vec<u8> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.h5");
    let file = create(&path, is_latest);
    fill(&file);
    file.close().unwrap();
    std::fs::read(&path).unwrap()
}

fn sample(is_latest: bool) -> Vec<u8> {
    bytes_of(is_latest, |file| {
        let group = file.create_group("VTKHDF").unwrap();
        write(&group, "Points", 3, &[0.5; 30]).unwrap();
        write(&group, "Empty", 1, &[0_u64; 0]).unwrap();
        for k in 0..40 {
            file.create_group(&format!("g{k}")).unwrap();
        }
    })
}

#[test]
fn our_own_files_are_understood_in_both_formats() {
    for is_latest in [false, true] {
        let structure = read(sample(is_latest).as_slice()).unwrap_or_else(|refusal| panic!("{refusal}"));
        let points = &structure.data_sets["/VTKHDF/Points"];
        assert_eq!((points.extent.as_slice(), points.element_bytes, points.is_float()), ([10, 3].as_slice(), 8, true));
        assert_eq!(structure.data_sets["/VTKHDF/Empty"].elements(), 0);
        assert_eq!(structure.groups.len(), 42);
    }
}

#[test]
fn whatever_is_cut_or_turned_is_refused_or_understood_and_never_a_panic() {
    for is_latest in [false, true] {
        let bytes = sample(is_latest);
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "{length}");
        }
        for k in (0..bytes.len() * 8).step_by(11) {
            let mut broken = bytes.clone();
            broken[k / 8] ^= 1 << (k % 8);
            let _ = read(broken.as_slice());
        }
    }
    assert_eq!(read(b"solid".as_slice()), Err(Refusal::NotHdf5));
}

/// Fills data sets whose chunks have each kind of index, with and without filters.
fn indexes(file: &Group, values: &[f64]) {
    let rows = values.len() / 3;
    for (name, chunk) in [("whole", (rows, 3)), ("rows", (7, 3)), ("cut", (7, 2)), ("single", (1, 1))] {
        for is_filtered in [false, true] {
            for free in 0..3 {
                let mut builder = file.new_dataset::<f64>().chunk(chunk);
                if is_filtered {
                    builder = builder.shuffle().deflate(4).fletcher32();
                }
                let builder = match free {
                    0 => builder.shape((rows, 3)),
                    1 => builder.shape((rows.., 3)),
                    _ => builder.shape((rows.., 3..)),
                };
                builder.create(format!("{name}_{is_filtered}_{free}").as_str()).unwrap().write_raw(values).unwrap();
            }
        }
    }
}

#[test]
fn numbers_come_back_from_every_storage() {
    let values: Vec<f64> = (0..3 * 1500).map(|k| f64::from(k).sin()).collect();
    for is_latest in [false, true] {
        let bytes = bytes_of(is_latest, |file| indexes(file, &values));
        let structure = read(bytes.as_slice()).unwrap();
        assert_eq!(structure.data_sets.len(), 24);
        for (place, data_set) in &structure.data_sets {
            let found = reals(bytes.as_slice(), place, data_set);
            assert!(found.as_ref() == Ok(&values), "{place}: {:?}", found.map(|found| found.len()));
        }
    }
}

#[test]
fn whole_numbers_have_their_signs_and_texts_are_no_numbers() {
    let bytes = bytes_of(true, |file| {
        file.new_dataset::<i16>().shape(3).create("short").unwrap().write_raw(&[-2_i16, 0, i16::MAX]).unwrap();
        file.new_dataset::<u64>().shape(2).create("long").unwrap().write_raw(&[1_u64, u64::MAX]).unwrap();
        file.new_dataset::<bool>().shape(2).create("flags").unwrap().write_raw(&[true, false]).unwrap();
        file.new_dataset::<f32>().shape(2).create("float").unwrap().write_raw(&[1.5_f32, -0.25]).unwrap();
    });
    let structure = read(bytes.as_slice()).unwrap();
    let at = |place: &'static str| (bytes.as_slice(), place, &structure.data_sets[place]);
    let whole = |(bytes, place, data_set)| integers(bytes, place, data_set);
    assert_eq!(whole(at("/short")), Ok(vec![-2, 0, i64::from(i16::MAX)]));
    assert!(whole(at("/long")).is_err());
    assert!(whole(at("/float")).is_err());
    let real = |(bytes, place, data_set)| reals(bytes, place, data_set);
    assert_eq!(real(at("/float")), Ok(vec![1.5, -0.25]));
    assert!(real(at("/flags")).unwrap_err().to_string().contains("no numbers"));
}

#[test]
fn a_damaged_chunk_does_not_match_its_check_sum() {
    let values: Vec<f64> = (0..300).map(|k| f64::from(k) + 0.123).collect();
    let bytes = bytes_of(false, |file| {
        write(file, "sum", 1, &values).unwrap();
    });
    let structure = read(bytes.as_slice()).unwrap();
    let at = bytes.windows(8).position(|window| window == values[7].to_le_bytes()).unwrap();
    let mut broken = bytes.clone();
    broken[at] ^= 4;
    assert_eq!(reals(bytes.as_slice(), "/sum", &structure.data_sets["/sum"]), Ok(values));
    let refusal = reals(broken.as_slice(), "/sum", &structure.data_sets["/sum"]).unwrap_err().to_string();
    assert!(refusal.contains("/sum") && refusal.contains("check sum"), "{refusal}");
}

#[test]
fn contents_are_what_libhdf5_wrote_in_one_piece_and_in_chunks() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.h5");
    let values: Vec<u64> = (0..3 * 200_000).map(|k| k * k).collect();
    let file = File::create(&path).unwrap();
    write(&file, "chunks", 3, &values).unwrap();
    file.new_dataset::<u64>().shape(values.len()).create("piece").unwrap().write_raw(&values).unwrap();
    file.new_dataset::<u64>().chunk(100).shape(1000).create("holes").unwrap();
    file.close().unwrap();
    let file = std::fs::File::open(&path).unwrap();
    let structure = read(&file).unwrap();
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    assert!(contents(&file, "/chunks", &structure.data_sets["/chunks"]).unwrap() == bytes);
    assert!(contents(&file, "/piece", &structure.data_sets["/piece"]).unwrap() == bytes);
    let refusal = contents(&file, "/holes", &structure.data_sets["/holes"]).unwrap_err().to_string();
    assert!(refusal.contains("0 of 10 chunks are there"), "{refusal}");
}
