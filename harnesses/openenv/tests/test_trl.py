"""TRL's GRPO trainer plays training tasks with a tiny model: two optimiser steps change its weights."""

import json
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="torch is not installed")
trl = pytest.importorskip("trl", reason="TRL is not installed: pip install trl")

from datasets import Dataset
from tokenizers import Tokenizer, decoders, models, pre_tokenizers, trainers
from transformers import PreTrainedTokenizerFast, Qwen2Config, Qwen2ForCausalLM

from humanclaw import Choice, Plugins
from humanclaw_openenv.trl import environment

MARKS = ("<|endoftext|>", "<|im_start|>", "<|im_end|>", "<tool_call>", "</tool_call>", "<think>", "</think>")
TEMPLATE = Path(trl.__file__).parent / "chat_templates" / "qwen3.jinja"
SEED = 3
LENGTHS = (10, 30, 50, 70)


@pytest.fixture(scope="module")
def kind():
    few = Plugins.discover(choice=Choice(skills=("walk", "stop")))  # A short prompt, for a short test.
    return environment("approach", {"progress": 1.0}, options={"houses": 1}, pictures=False, plugins=few)


def _walk(z):
    call = json.dumps({"name": "walk", "arguments": {"thoughts": "", "x_cm": 0, "z_cm": z, "yaw_deg": 0}})
    return f"<tool_call>\n{call}\n</tool_call>"


def _tokenizer():
    """Return a tokenizer of letters that has one word for each of four calls."""
    made = Tokenizer(models.BPE())
    made.pre_tokenizer, made.decoder = pre_tokenizers.ByteLevel(add_prefix_space=False), decoders.ByteLevel()
    made.train_from_iterator([], trainers.BpeTrainer(initial_alphabet=pre_tokenizers.ByteLevel.alphabet()))
    # Not special: the parser of tool calls has to see them in the decoded text.
    made.add_tokens([*map(_walk, LENGTHS), *(mark for mark in MARKS if "|" not in mark)])
    made.add_special_tokens([mark for mark in MARKS if "|" in mark])
    return PreTrainedTokenizerFast(
        tokenizer_object=made, eos_token="<|im_end|>", pad_token="<|endoftext|>",
        chat_template=TEMPLATE.read_text("utf-8"),
    )  # fmt: skip


def _model(tokenizer):
    torch.manual_seed(SEED)
    shape = {"hidden_size": 32, "intermediate_size": 64, "num_hidden_layers": 2, "max_position_embeddings": 16384}
    heads = {"num_attention_heads": 4, "num_key_value_heads": 2, "vocab_size": len(tokenizer)}
    ends = {"eos_token_id": tokenizer.eos_token_id, "pad_token_id": tokenizer.pad_token_id}
    return Qwen2ForCausalLM(Qwen2Config(**shape, **heads, **ends))


def test_a_tool_of_the_environment_is_a_skill_as_the_bench_tells_it(kind):
    from transformers.utils import get_json_schema

    tool = get_json_schema(kind().walk)["function"]
    assert tool["name"] == "walk"
    assert next(iter(tool["parameters"]["properties"])) == "thoughts"
    assert tool["parameters"]["properties"]["z_cm"]["type"] == "integer"
    assert "Walking into a wall" in tool["description"]


def test_an_environment_ends_with_its_task(kind):
    env = kind()
    assert "walk up to the" in env.reset(seed=SEED)
    assert "Executed walk" in env.walk(thoughts="", x_cm=0, z_cm=50, yaw_deg=0)
    assert 0.1 < env.get_reward() < 1
    env.stop(thoughts="")
    assert env.walk(thoughts="", x_cm=0, z_cm=50, yaw_deg=0) == "The task is over."


def test_a_dataset_without_seeds_is_refused(kind):
    with pytest.raises(TypeError, match="seed"):
        kind().reset(prompt=[])


def test_two_steps_of_grpo_change_the_weights(kind, tmp_path):
    """The model is new. What it says at random is a call of four, as the other words are suppressed."""
    tokenizer = _tokenizer()
    model, words = _model(tokenizer), {*map(_walk, LENGTHS), tokenizer.eos_token}
    silent = [number for word, number in tokenizer.get_vocab().items() if word not in words]
    before = {name: weights.detach().clone() for name, weights in model.named_parameters()}
    config = trl.GRPOConfig(
        output_dir=str(tmp_path), max_steps=2, num_generations=4, per_device_train_batch_size=4, learning_rate=1e-2,
        max_completion_length=400, max_tool_calling_iterations=1, report_to=[], use_cpu=True, logging_steps=1,
        save_strategy="no", seed=SEED, bf16=False, generation_kwargs={"suppress_tokens": silent},
    )  # fmt: skip
    data = Dataset.from_dict({"prompt": [[{"role": "user", "content": ""}]] * 8, "seed": [SEED] * 8})
    trainer = trl.GRPOTrainer(
        model=model, args=config, train_dataset=data, processing_class=tokenizer, environment_factory=kind
    )
    trainer.train()
    logs = [log for log in trainer.state.log_history if "reward" in log]
    assert trainer.state.global_step == 2
    assert all(log["tools/call_frequency"] > 0 for log in logs)
    assert any(log["reward_std"] > 0 for log in logs)
    assert any(not torch.equal(before[name], weights) for name, weights in model.named_parameters())
