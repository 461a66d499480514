"""Banks and marker: old or new after every interruption, defaults and a flag after decay."""

from __future__ import annotations

import contextlib
import dataclasses
import struct
import zlib

import pytest

from devices.coefficient_store import (
    FORMER_IMAGE_LENGTH,
    IMAGE_LENGTH,
    CoefficientStore,
    MemoryMedium,
)
from protocols.errors import FrameError
from protocols.uds import (
    BANK_LENGTH,
    DEFAULT_COEFFICIENTS,
    PLAIN_BANK_LENGTH,
    pack_coefficients,
)

OLD = dataclasses.replace(DEFAULT_COEFFICIENTS, version=1, mag_offset_mg=(1.0, 2.0, 3.0))
NEW = dataclasses.replace(
    DEFAULT_COEFFICIENTS,
    version=2,
    mag_offset_mg=(-7.0, 8.0, -9.0),
    mag_matrix=tuple(1.0 + index / 8.0 for index in range(9)),
    accel_offset_g=(0.5, 0.25, 0.125),
    hk_mg=(8000.0, 0.0, 7500.0),
)


class TornMedium(MemoryMedium):
    """Loses power after a number of bytes: what came before is stored, the rest is not."""

    def __init__(self, image: bytes, budget: int) -> None:
        super().__init__(image)
        self.budget = budget
        self.used = 0

    def write(self, image: bytes, changed: slice) -> None:
        length = changed.stop - changed.start
        fits = min(max(self.budget - self.used, 0), length)
        self.used += length
        stored = self.read() or bytes(IMAGE_LENGTH)
        cut = changed.start + fits
        prefix = image if not self.read() else stored
        super().write(prefix[: changed.start] + image[changed.start : cut] + prefix[cut:], changed)
        if fits < length:
            raise PowerLost


class PowerLost(Exception):  # noqa: N818
    """The supply failed."""


def calibrated(coefficients=OLD):
    medium = MemoryMedium()
    write(CoefficientStore(medium=medium), coefficients)
    return medium.read()


def write(store, coefficients):
    store.boot()
    store.stage(pack_coefficients(coefficients))
    assert store.commit()
    store.boot()


def reopened(image):
    store = CoefficientStore(medium=MemoryMedium(image))
    store.boot()
    return store


def test_a_fresh_module_has_the_defaults_and_nothing_lost():
    store = reopened(b"")

    assert store.active == DEFAULT_COEFFICIENTS
    assert not store.calibrated
    assert not store.lost
    assert store.boots == 1


def test_a_committed_bank_is_used_from_the_next_boot_on():
    store = reopened(calibrated())
    store.stage(pack_coefficients(NEW))
    assert store.active == OLD
    store.commit()
    assert store.active == OLD

    store.boot()

    assert store.active == NEW
    assert store.calibrated


def test_a_staged_bank_reads_back_and_is_not_used_without_commit():
    store = reopened(calibrated())
    store.stage(pack_coefficients(NEW))

    assert store.staged() == pack_coefficients(NEW)
    store.boot()
    assert store.active == OLD


def test_rollback_drops_the_staged_bank():
    store = reopened(calibrated())
    store.stage(pack_coefficients(NEW))
    store.rollback()

    assert store.staged() is None
    assert not store.commit()


def test_rollback_undoes_a_commit_until_the_next_boot():
    store = reopened(calibrated())
    store.stage(pack_coefficients(NEW))
    store.commit()
    store.rollback()
    store.boot()

    assert store.active == OLD


def test_nothing_can_be_staged_over_the_old_bank_while_a_commit_waits():
    store = reopened(calibrated())
    store.stage(pack_coefficients(NEW))
    store.commit()

    with pytest.raises(RuntimeError, match="reset the module or roll back"):
        store.stage(pack_coefficients(OLD))


def test_a_bank_with_a_wrong_crc_is_refused_and_nothing_changes():
    store = reopened(calibrated())
    bank = bytearray(pack_coefficients(NEW))
    bank[20] ^= 1

    with pytest.raises(FrameError):
        store.stage(bytes(bank))

    assert store.staged() is None


def test_boots_are_counted_through_writes():
    store = reopened(calibrated())
    before = store.boots
    store.boot()

    assert store.boots == before + 1


@pytest.mark.parametrize("former", [DEFAULT_COEFFICIENTS, OLD])
def test_power_lost_at_any_byte_leaves_the_old_or_the_new(former):
    image = reopened_image = calibrated(OLD) if former == OLD else fresh()
    whole = TornMedium(image, 10**6)
    write(CoefficientStore(medium=whole), NEW)
    seen = []
    for budget in range(whole.used + 1):
        medium = TornMedium(reopened_image, budget)
        with contextlib.suppress(PowerLost):
            write(CoefficientStore(medium=medium), NEW)
        store = reopened(medium.read())
        assert store.active in (former, NEW), f"a mixture after {budget} bytes"
        assert not store.lost
        seen.append(store.active == NEW)

    assert seen == sorted(seen), "once new, always new"
    assert seen[0] is False
    assert seen[-1] is True


def fresh():
    medium = MemoryMedium()
    CoefficientStore(medium=medium).boot()
    return medium.read()


def test_a_module_that_lost_power_while_staging_can_be_written_again():
    image = calibrated()
    medium = TornMedium(image, 60)
    with pytest.raises(PowerLost):
        write(CoefficientStore(medium=medium), NEW)
    store = reopened(medium.read())

    store.stage(pack_coefficients(NEW))
    store.commit()
    store.boot()

    assert store.active == NEW


@pytest.mark.parametrize("position", range(0, IMAGE_LENGTH, 3))
def test_a_flipped_byte_never_gives_coefficients_that_nobody_wrote(position):
    image = bytearray(calibrated())
    image[position] ^= 0x55

    store = reopened(bytes(image))

    assert store.active in (DEFAULT_COEFFICIENTS, OLD)
    assert store.calibrated == (store.active == OLD)


def test_a_decayed_bank_gives_the_defaults_and_says_so():
    image = bytearray(calibrated())
    image[32 + 10] ^= 0xFF
    image[32 + BANK_LENGTH + 10] ^= 0xFF

    store = reopened(bytes(image))

    assert store.lost
    assert store.active == DEFAULT_COEFFICIENTS


@pytest.mark.parametrize("length", [1, 7, 31, IMAGE_LENGTH - 1, IMAGE_LENGTH + 1])
def test_an_image_of_another_length_is_lost_and_can_be_written_again(length):
    image = (calibrated() + b"x")[:length]
    store = reopened(image)
    assert store.lost

    store.stage(pack_coefficients(NEW))
    store.commit()
    store.boot()

    assert store.active == NEW
    assert not store.lost


def test_a_file_keeps_the_coefficients_for_the_next_process(tmp_path):
    path = tmp_path / "module.nvm"
    write(CoefficientStore(path), NEW)

    store = CoefficientStore(path)
    store.boot()

    assert store.active == NEW
    assert path.stat().st_size == IMAGE_LENGTH


def test_a_leftover_of_a_killed_write_does_no_harm(tmp_path):
    path = tmp_path / "module.nvm"
    write(CoefficientStore(path), OLD)
    (tmp_path / "module.nvm.new").write_bytes(b"half")

    store = CoefficientStore(path)
    store.boot()

    assert store.active == OLD


def test_a_medium_that_refuses_is_an_error_of_the_write_and_keeps_the_old(tmp_path):
    path = tmp_path / "module.nvm"
    write(CoefficientStore(path), OLD)
    store = CoefficientStore(path)
    (tmp_path / "module.nvm.new").mkdir()

    with pytest.raises(OSError, match="module.nvm.new"):
        store.stage(pack_coefficients(NEW))

    assert CoefficientStore(path).active == OLD


def with_crc(body, before=b""):
    return body + zlib.crc32(before + body).to_bytes(4, "little")


def former_image(active=0, *, staged=0, boots=12):
    """An image as it was before the cross-axis term: two markers, OLD in the first of two banks."""
    magic = b"CBNVM01\0"
    markers = [struct.pack("<IBBH", number, active, staged, boots) for number in (4, 5)]
    values = (
        *OLD.mag_offset_mg, *OLD.mag_matrix, *OLD.accel_offset_g, *OLD.accel_matrix, 0.0, 0.0,
    )  # fmt: skip
    bank = with_crc(struct.pack("<H2x26f", OLD.version, *values))
    image = magic + b"".join(with_crc(marker, magic) for marker in markers)
    return image + bank + bytes(PLAIN_BANK_LENGTH)


def test_an_image_of_the_former_layout_keeps_its_coefficients_and_its_boots():
    assert len(former_image()) == FORMER_IMAGE_LENGTH
    medium = MemoryMedium(former_image())
    store = CoefficientStore(medium=medium)
    store.boot()

    assert store.active == OLD
    assert store.active.hk_mg == (0.0, 0.0, 0.0)
    assert store.calibrated
    assert not store.lost
    assert store.boots == 13
    assert len(medium.read()) == IMAGE_LENGTH
    assert reopened(medium.read()).active == OLD


def test_an_image_of_the_former_layout_takes_coefficients_of_the_present_one():
    medium = MemoryMedium(former_image())

    write(CoefficientStore(medium=medium), NEW)

    assert reopened(medium.read()).active == NEW


def test_a_file_of_the_former_layout_is_replaced_whole(tmp_path):
    path = tmp_path / "module.nvm"
    path.write_bytes(former_image())
    assert CoefficientStore(path).active == OLD
    assert path.read_bytes() == former_image(), "reading alone writes nothing"

    CoefficientStore(path).boot()

    assert path.stat().st_size == IMAGE_LENGTH
    assert CoefficientStore(path).active == OLD


@pytest.mark.parametrize("position", range(0, FORMER_IMAGE_LENGTH, 5))
def test_a_flipped_byte_of_a_former_image_gives_no_coefficients_that_nobody_wrote(position):
    image = bytearray(former_image())
    image[position] ^= 0x55

    store = reopened(bytes(image))

    assert store.active in (DEFAULT_COEFFICIENTS, OLD)
    assert store.calibrated == (store.active == OLD)


def test_a_former_image_without_a_sound_bank_is_lost():
    image = bytearray(former_image())
    image[32 + 10] ^= 0xFF

    store = reopened(bytes(image))

    assert store.lost
    assert store.active == DEFAULT_COEFFICIENTS
